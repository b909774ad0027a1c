package org.rayfarm.agent;

/** The verb `probe`: what the device is, how exactly it computes, and which counters can be read. */
final class Probe {
    private Probe() {
    }

    static void run(Device device, Arguments arguments, Record record) throws Exception {
        Samples samples = new Samples(arguments.samples, 1);
        samples.take();
        record.put(new Frames(0, null), samples);
        device.json().put("precision", new Precision().json());
        record.put("device", device.json());
    }
}
