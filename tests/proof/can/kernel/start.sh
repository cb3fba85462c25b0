#!BUSYBOX sh
# The head of what the first process of the virtual machine does: a system with CAN. What follows
# prints "step NAME" and what each step gave.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin SARRUS_ROOT=/run/sarrus
B=BUSYBOX
$B mount -t proc proc /proc; $B mount -t sysfs sysfs /sys
$B mkdir -p /dev/pts /dev/shm; $B mount -t devpts devpts /dev/pts; $B mount -t tmpfs tmpfs /dev/shm; $B mount -t tmpfs tmpfs /run
M=/usr/lib/uml/modules/$($B uname -r)/kernel
for m in net/can/can net/can/can-raw drivers/net/can/dev/can-dev drivers/net/can/vcan drivers/net/can/slcan/slcan; do
    $B insmod $M/$m.ko || echo "no module $m"
done
# not the one of busybox, which knows no `type can`
ip() { IPROUTE "$@"; }
ip link add dev vcan0 type vcan; ip link set vcan0 mtu 72 up
ip link add dev vcan1 type vcan; ip link set vcan1 mtu 16 up
# a file holds a word, on so many lines or one
wait_for() {
    waits=0
    while found=$($B grep -c "$2" "$1" 2>/dev/null); [ "${found:-0}" -lt "${3:-1}" ]; do
        waits=$((waits + 1)); [ $waits -gt 200 ] && { echo "no $2 in $1:"; $B cat "$1"; return; }; $B sleep 0.1
    done
}
