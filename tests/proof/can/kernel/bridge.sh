# The bridge: power on and off, a bus that goes away and comes back, bit rates.
# Motors take orders on descriptor 3.
MOTORS=none
# writes the motors' current reports
report() {
    n=$(($($B grep -c '"report"' $MOTORS) + 1))
    echo report >&3; wait_for $MOTORS '"report"' $n
    $B grep '"report"' $MOTORS | $B tail -n 1 > /run/report
}
# asks until all motors have power, or none of them
until_power() {
    tries=0
    while report; $B grep -q "\"power\":$2" /run/report; do
        tries=$((tries + 1)); [ $tries -gt 50 ] && { echo "the power does not become $1"; break; }; $B sleep 0.1
    done
    $B cat /run/report
}
powered() { until_power true false; }
unpowered() { until_power false true; }
bridge() {
    $B rm -f /run/bridge /run/controller
    FRONTEND run $1 --name kernel > /run/bridge 2>&1 & BRIDGE=$!
    wait_for /run/bridge "ready kernel"
    HOLD kernel 20 1 > /run/controller 2>&1 & CONTROLLER=$!
    wait_for /run/controller holds
}
arm() { PROGRAM arm kernel --timeout ${1:-10} 2>&1; echo "code $?"; }
reset_and_arm() { PROGRAM reset kernel; arm; }
end() { $B kill -TERM $BRIDGE; wait $BRIDGE; echo "code $?"; $B kill $CONTROLLER; wait $CONTROLLER; }

echo "step power"
$B mkfifo /run/orders; MOTORS=/run/motors
PROGRAM simulate FOLDER/vcan.yml > $MOTORS 2>&1 < /run/orders & SIMULATED=$!
exec 3> /run/orders
wait_for $MOTORS "ready arm"
bridge FOLDER/vcan.yml
arm; powered
echo "step term"
end; unpowered

echo "step down"
bridge FOLDER/vcan.yml
arm; powered
ip link set vcan0 down
wait_for /run/bridge "vcan0 is down"; arm 1
echo "step up"
ip link set vcan0 up
wait_for /run/bridge "open again"; unpowered
$B sleep 1; arm 1; unpowered
echo "step reset"
reset_and_arm; powered

echo "step removed"
ip link del vcan0
wait_for /run/bridge "No such device"
ip link add dev vcan0 type vcan; ip link set vcan0 mtu 72 up
wait_for /run/bridge "open again" 2; unpowered
arm 1
echo "step added"
reset_and_arm; powered

echo "step told"
cansend vcan0 20000040#0000000000000000; unpowered
arm 1
cansend vcan0 20000100#0000000000000000
reset_and_arm; powered
end; unpowered
$B cat /run/bridge
$B kill $SIMULATED
echo "step end"
