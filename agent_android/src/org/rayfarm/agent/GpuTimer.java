package org.rayfarm.agent;

import android.opengl.GLES20;
import android.opengl.GLES30;

/** GPU time of a frame by GL_EXT_disjoint_timer_query, as far as Java's GLES can read it: 32 bits of nanoseconds. */
final class GpuTimer {
    /** What {@link #read} gives where the time is not known. */
    static final long UNKNOWN = -1;

    private static final String EXTENSION = "GL_EXT_disjoint_timer_query";
    private static final int TIME_ELAPSED = 0x88BF;
    private static final int COUNTER_BITS = 0x8864;
    private static final int DISJOINT = 0x8FBB;
    private static final long WRAP = 1L << 32;
    private static final long SATURATED = WRAP - 1;
    private static final long SLACK_NS = 1000000;

    private final int[] query = new int[1];
    private final int[] answer = new int[1];

    private GpuTimer() {
        GLES30.glGenQueries(1, query, 0);
    }

    /** A timer, or null where the device has none that counts. */
    static GpuTimer open(Device device) {
        if (!device.has(EXTENSION)) {
            return null;
        }
        int[] bits = new int[1];
        GLES30.glGetQueryiv(TIME_ELAPSED, COUNTER_BITS, bits, 0);
        GpuTimer timer = new GpuTimer();
        timer.begin();
        timer.end();
        return Gl.failed() || bits[0] == 0 ? null : timer;
    }

    void begin() {
        GLES30.glBeginQuery(TIME_ELAPSED, query[0]);
    }

    void end() {
        GLES30.glEndQuery(TIME_ELAPSED);
    }

    /** Nanoseconds of the frame just finished, which took {@code wallNs} to completion, or UNKNOWN. */
    long read(long wallNs) {
        GLES30.glGetQueryObjectuiv(query[0], GLES30.GL_QUERY_RESULT, answer, 0);
        return certain(answer[0] & SATURATED, wallNs);
    }

    /** Whether something (a change of clocks, say) spoilt the times since the last call. */
    boolean disjoint() {
        answer[0] = 0;
        GLES20.glGetIntegerv(DISJOINT, answer, 0);
        return answer[0] != 0;
    }

    /**
     * The time that 32 bits stand for: the counter may have wrapped, but a frame's GPU time is no longer than its time
     * to completion. UNKNOWN where that leaves no time or several.
     */
    static long certain(long bits, long wallNs) {
        long most = wallNs + SLACK_NS;
        boolean several = bits + WRAP <= most;
        boolean saturated = bits == SATURATED;
        return bits > most || several || saturated ? UNKNOWN : bits;
    }
}
