package org.rayfarm.desktop;

import java.nio.Buffer;
import java.nio.ByteBuffer;
import java.util.Arrays;
import org.lwjgl.system.MemoryUtil;

/** What the stand-ins of Android's classes share. */
public final class Shim {
    private static Switches switches = new Switches(System.getenv());

    private Shim() {
    }

    /** The switches in force. */
    public static Switches switches() {
        return switches;
    }

    /** Put other switches in force, for several runs in one process. */
    public static void switches(Switches chosen) {
        switches = chosen;
    }

    /** The address of a direct buffer's next byte, 0 for none. */
    public static long address(Buffer buffer) {
        if (buffer == null) {
            return 0;
        }
        if (!buffer.isDirect()) {
            throw new IllegalArgumentException("must use a native order direct Buffer");
        }
        return MemoryUtil.memAddress((ByteBuffer) buffer);
    }

    /** {@code count} values from an offset; the array itself where that is all of it. */
    public static int[] part(int[] values, int offset, int count) {
        return offset == 0 && values.length == count ? values : Arrays.copyOfRange(values, offset, offset + count);
    }

    /** {@code count} values from an offset; the array itself where that is all of it. */
    public static float[] part(float[] values, int offset, int count) {
        return offset == 0 && values.length == count ? values : Arrays.copyOfRange(values, offset, offset + count);
    }

    /** Put values into an array from an offset on. */
    public static void put(int[] values, int[] into, int offset) {
        System.arraycopy(values, 0, into, offset, values.length);
    }
}
