"""The phone agent: its Java program, its build, its desktop shim, and a stand-in phone to run it on."""
