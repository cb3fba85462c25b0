# Frames, states and full queues.
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
PROGRAM simulate FOLDER/kernel.yml > /run/full 2>&1 < /run/orders2 &
MOTOR=$!
exec 4> /run/orders2
wait_for /run/full "ready arm"
cansend slcan0 003#FFFFFFFFFFFFFFFD; $B sleep 0.5
# the adapter stops, and the queue fills while the motor sleeps; the local echo of frames goes on,
# and the answers find no room
$B kill -STOP $ADAPTER $MOTOR
cangen slcan0 -g 0 -i -n 6000 -I 003 -L 8
$B kill -CONT $MOTOR; $B sleep 0.5
echo report >&4; wait_for /run/full report
$B grep report /run/full
echo "step end"
$B kill -CONT $ADAPTER
