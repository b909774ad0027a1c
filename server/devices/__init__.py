"""Devices over adb: what is attached, and the phone's agent as a host that runs plans."""
