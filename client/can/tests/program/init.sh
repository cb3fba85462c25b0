#!BUSYBOX sh
# The first process of the virtual machine: it prints "step NAME" and what each step gave.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
B=BUSYBOX
$B mount -t proc proc /proc; $B mount -t sysfs sysfs /sys
$B mkdir -p /dev/pts /dev/shm; $B mount -t devpts devpts /dev/pts; $B mount -t tmpfs tmpfs /dev/shm; $B mount -t tmpfs tmpfs /run
M=/usr/lib/uml/modules/$($B uname -r)/kernel
for m in net/can/can net/can/can-raw drivers/net/can/dev/can-dev drivers/net/can/vcan drivers/net/can/slcan/slcan; do
    $B insmod $M/$m.ko || echo "no module $m"
done
ip link add dev vcan0 type vcan; ip link set vcan0 mtu 72 up
ip link add dev vcan1 type vcan; ip link set vcan1 mtu 16 up
wait_for() { n=0; while ! $B grep -q "$2" "$1" 2>/dev/null; do n=$((n + 1)); [ $n -gt 100 ] && { echo "no $2 in $1"; return; }; $B sleep 0.1; done; }

echo "step enable"
PROGRAM simulate FOLDER/vcan.yml > /run/motors 2>&1 < /dev/null &
wait_for /run/motors "ready arm"
candump -L vcan0 > /run/dump & DUMP=$!
PROGRAM listen --channel vcan0 --data-bitrate 5000000 > /run/heard 2> /run/listen & LISTEN=$!
wait_for /run/listen ready; $B sleep 0.3
cansend vcan0 003#FFFFFFFFFFFFFFFC
cansend vcan0 1ABCDEF0##10011223344556677
wait_for /run/dump " 013#"; wait_for /run/heard " 013#"; wait_for /run/heard "##1"; wait_for /run/motors power
$B cut -d' ' -f2- /run/dump
echo "step heard"
$B cut -d' ' -f2- /run/heard
$B cat /run/motors
$B kill $DUMP $LISTEN

echo "step classic"
PROGRAM listen --channel vcan1 --data-bitrate 5000000; echo "code $?"
PROGRAM listen --channel none; echo "code $?"

echo "step states"
$B mkfifo /run/orders
PROGRAM simulate FOLDER/slcan.yml --pty > /run/adapter 2>&1 < /run/orders &
ADAPTER=$!
exec 3> /run/orders
wait_for /run/adapter "ready arm"
# slcand puts /dev/ before its port
slcand -o -s8 ..FOLDER/bus slcan0 || echo "no slcand"
$B sleep 0.5; ip link set slcan0 up
PROGRAM listen --channel slcan0 > /run/heard 2> /run/listen & LISTEN=$!
wait_for /run/listen ready
cansend slcan0 003#FFFFFFFFFFFFFFFD; wait_for /run/heard " 013#"
echo warning >&3; wait_for /run/listen ErrorWarning
echo passive >&3; wait_for /run/listen ErrorPassive
echo active >&3; wait_for /run/listen ErrorActive
echo busoff >&3; wait_for /run/listen BusOff
$B cut -d' ' -f3- /run/listen
$B kill $LISTEN

echo "step full"
ip link set slcan0 down; echo active >&3; $B sleep 0.3; ip link set slcan0 up
$B mkfifo /run/orders2
PROGRAM simulate FOLDER/full.yml > /run/full 2>&1 < /run/orders2 &
MOTOR=$!
exec 4> /run/orders2
wait_for /run/full "ready arm"
cansend slcan0 003#FFFFFFFFFFFFFFFD; $B sleep 0.5
# the adapter stops, and the queue fills while the motor sleeps; what was sent is heard on this computer all the same, and its answers find
# no room
$B kill -STOP $ADAPTER $MOTOR
cangen slcan0 -g 0 -i -n 6000 -I 003 -L 8
$B kill -CONT $MOTOR; $B sleep 0.5
echo report >&4; wait_for /run/full report
$B grep report /run/full
echo "step end"
$B kill -CONT $ADAPTER
$B poweroff -f
