package org.rayfarm.agent;

import android.opengl.GLES20;
import android.os.Process;
import org.json.JSONArray;
import org.json.JSONException;
import org.json.JSONObject;

/** The timed frames: their times in the order run. */
final class Frames {
    private final long[] wallNs;
    private final long[] cpuMs;
    private final long[] gpuNs;
    private final boolean[] disjoint;
    private final GpuTimer timer;
    private volatile int done;

    /** {@code timer} may be null. */
    Frames(int count, GpuTimer timer) {
        wallNs = new long[count];
        cpuMs = new long[count];
        gpuNs = new long[count];
        disjoint = new boolean[count];
        this.timer = timer;
    }

    /** Time one more frame to completion. */
    void time(Runner runner) throws Exception {
        int i = done;
        if (timer != null) {
            timer.disjoint();
        }
        long cpu = Process.getElapsedCpuTime();
        long wall = System.nanoTime();
        if (timer != null) {
            timer.begin();
        }
        runner.frame();
        if (timer != null) {
            timer.end();
        }
        GLES20.glFinish();
        wallNs[i] = System.nanoTime() - wall;
        cpuMs[i] = Process.getElapsedCpuTime() - cpu;
        gpuNs[i] = GpuTimer.UNKNOWN;
        if (timer != null) {
            long gpu = timer.read(wallNs[i]);
            disjoint[i] = timer.disjoint();
            gpuNs[i] = disjoint[i] ? GpuTimer.UNKNOWN : gpu;
        }
        done = i + 1;
    }

    /** The frames done so far, as the record has them. */
    JSONArray json() throws JSONException {
        JSONArray frames = new JSONArray();
        int count = done;
        for (int i = 0; i < count; i++) {
            JSONObject frame = new JSONObject();
            frame.put("wall_ns", wallNs[i]).put("cpu_ns", cpuMs[i] * 1000000L);
            frame.put("gpu_ns", gpuNs[i] == GpuTimer.UNKNOWN ? JSONObject.NULL : (Object) Long.valueOf(gpuNs[i]));
            frames.put(frame.put("disjoint", disjoint[i]));
        }
        return frames;
    }
}
