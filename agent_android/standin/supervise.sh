#!/bin/sh
# Runs in the phone: starts adbd ("plug") and kills it ("unplug") as its standard input says, and at its end, which is
# also the owner's death, ends everything on the phone. adbd's command is in the arguments.
cd / || exit 1
echo "ready $$"
while read -r order; do
    case $order in
    plug)
        "$@" </dev/null >>/standin/state/adbd.log 2>&1 &
        adbd=$!
        echo "plugged $adbd"
        ;;
    unplug)
        kill -KILL "$adbd"
        wait "$adbd" 2>/dev/null
        echo unplugged
        ;;
    esac
done
kill -KILL -1
