#!BUSYBOX sh
# Start of the script of the virtual machine's first process: sets up a system with CAN. The rest
# prints "step NAME" and the output of each step.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin SARRUS_ROOT=/run/sarrus
B=BUSYBOX
$B mount -t proc proc /proc; $B mount -t sysfs sysfs /sys
$B mkdir -p /dev/pts /dev/shm; $B mount -t devpts devpts /dev/pts
$B mount -t tmpfs tmpfs /dev/shm; $B mount -t tmpfs tmpfs /run
M=/usr/lib/uml/modules/$($B uname -r)/kernel
D=drivers/net/can
for m in net/can/can net/can/can-raw $D/dev/can-dev $D/vcan $D/slcan/slcan; do
    $B insmod $M/$m.ko || echo "no module $m"
done
# not busybox's, which has no `type can`
ip() { IPROUTE "$@"; }
ip link add dev vcan0 type vcan; ip link set vcan0 mtu 72 up
ip link add dev vcan1 type vcan; ip link set vcan1 mtu 16 up
# waits until a file holds a word, on the given number of lines or on one
wait_for() {
    waits=0
    while found=$($B grep -c "$2" "$1" 2>/dev/null); [ "${found:-0}" -lt "${3:-1}" ]; do
        waits=$((waits + 1)); [ $waits -gt 200 ] && { echo "no $2 in $1:"; $B cat "$1"; return; }; $B sleep 0.1
    done
}
