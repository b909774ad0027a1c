package org.rayfarm.agent;

import android.opengl.GLES20;

/** The verb `run`: one plan from its file to its frames or its tiles. */
final class Run {
    /** Frames are announced no more often than this. */
    private static final long ANNOUNCE_NS = 250000000L;

    private final Session session;
    private final Arguments arguments;
    private final Device device;
    private final Record record;

    Run(Session session, Arguments arguments, Device device, Record record) {
        this.session = session;
        this.arguments = arguments;
        this.device = device;
        this.record = record;
    }

    void run() throws Exception {
        session.doing("reading the plan");
        PlanFile file = new PlanFile(arguments.plan);
        try {
            device.limits.check(file.plan);
            Runner runner = ready(file);
            session.say("compiled");
            if (file.plan.collects()) {
                session.doing("collecting");
                runner.first(runner.collector(record.blobs()));
            } else {
                measure(runner);
            }
        } finally {
            file.close();
        }
    }

    private Runner ready(PlanFile file) throws Exception {
        Resources resources = new Resources(file.plan);
        session.doing("compiling");
        long begun = System.nanoTime();
        resources.compile();
        record.put("compile_ms", since(begun));
        session.doing("uploading");
        begun = System.nanoTime();
        resources.upload(file);
        GLES20.glFinish();
        record.put("upload_ms", since(begun));
        return new Runner(file.plan, resources);
    }

    private void measure(Runner runner) throws Exception {
        session.doing("warming up");
        long begun = System.nanoTime();
        runner.first(null);
        for (int i = 1; i < arguments.warmUp; i++) {
            runner.frame();
            GLES20.glFinish();
        }
        record.put("warm_up_ms", since(begun));
        time(runner);
        session.doing("reading the image back");
        runner.readImage(record.blobs());
    }

    private void time(Runner runner) throws Exception {
        Frames frames = new Frames(arguments.frames, GpuTimer.open(device));
        Samples samples = new Samples(arguments.samples, arguments.frames);
        record.put(frames, samples);
        long said = 0;
        for (int i = 1; i <= arguments.frames; i++) {
            session.frame(i);
            frames.time(runner);
            samples.take();
            Gl.check("running a frame");
            long now = System.nanoTime();
            if (i == 1 || i == arguments.frames || now - said > ANNOUNCE_NS) {
                session.say("frame " + i);
                said = now;
            }
        }
    }

    private static double since(long begun) {
        return (System.nanoTime() - begun) / 1e6;
    }
}
