# Bit rates and states of a controller, on the kernel's own slcan.
echo "step rate"
$B mkfifo /run/orders2; MOTORS=/run/motors2
PROGRAM simulate FOLDER/slcan.yml --pty > $MOTORS 2>&1 < /run/orders2 &
exec 3> /run/orders2
wait_for $MOTORS "ready arm"
# slcand puts /dev/ before its port
slcand -o -s8 ..FOLDER/bus slcan0 || echo "no slcand"
$B sleep 0.5
FRONTEND run FOLDER/kernel.yml --name kernel 2>&1; echo "code $?"
ip link set slcan0 up type can bitrate 500000
FRONTEND run FOLDER/kernel.yml --name kernel 2>&1; echo "code $?"
ip link set slcan0 down; ip link set slcan0 up type can bitrate 1000000
echo passive >&3; $B sleep 0.5
bridge FOLDER/kernel.yml
arm 1
echo active >&3
echo "step same"
arm; powered

echo "step off"
echo busoff >&3; wait_for $MOTORS '"watchdog"'; arm 1
PROGRAM listen --channel slcan0 2>&1; echo "code $?"
echo "step on"
ip link set slcan0 down; echo active >&3; $B sleep 0.3; ip link set slcan0 up
wait_for /run/bridge "open again"; unpowered
$B sleep 1; arm 1; unpowered
reset_and_arm; powered
echo "step last"
end; unpowered
echo "step end"
$B cat /run/bridge
