package android.opengl;

import java.nio.Buffer;
import java.nio.ByteOrder;
import org.lwjgl.opengles.EXTDisjointTimerQuery;
import org.lwjgl.system.MemoryUtil;
import org.rayfarm.desktop.Shim;

/** Stands in for Android's class on the desktop, as far as the agent calls it. */
public class GLES30 extends GLES20 {
    public static void glBeginQuery(int target, int id) {
        org.lwjgl.opengles.GLES30.glBeginQuery(target, id);
    }

    public static void glBindBufferBase(int target, int index, int buffer) {
        org.lwjgl.opengles.GLES30.glBindBufferBase(target, index, buffer);
    }

    public static void glBindVertexArray(int array) {
        org.lwjgl.opengles.GLES30.glBindVertexArray(array);
    }

    public static void glClearBufferfv(int buffer, int drawBuffer, float[] value, int offset) {
        org.lwjgl.opengles.GLES30.glClearBufferfv(buffer, drawBuffer, value);
    }

    public static void glClearBufferuiv(int buffer, int drawBuffer, int[] value, int offset) {
        org.lwjgl.opengles.GLES30.glClearBufferuiv(buffer, drawBuffer, value);
    }

    public static void glEndQuery(int target) {
        org.lwjgl.opengles.GLES30.glEndQuery(target);
    }

    public static void glGenQueries(int n, int[] ids, int offset) {
        int[] made = new int[n];
        org.lwjgl.opengles.GLES30.glGenQueries(made);
        Shim.put(made, ids, offset);
    }

    public static void glGenVertexArrays(int n, int[] arrays, int offset) {
        int[] made = new int[n];
        org.lwjgl.opengles.GLES30.glGenVertexArrays(made);
        Shim.put(made, arrays, offset);
    }

    public static void glGetInteger64v(int name, long[] params, int offset) {
        params[offset] = Shim.switches().integer(name, org.lwjgl.opengles.GLES30.glGetInteger64(name));
    }

    public static void glGetQueryObjectuiv(int id, int name, int[] params, int offset) {
        params[offset] = Shim.switches().timer(EXTDisjointTimerQuery.glGetQueryObjectui64EXT(id, name));
    }

    public static void glGetQueryiv(int target, int name, int[] params, int offset) {
        params[offset] = org.lwjgl.opengles.GLES30.glGetQueryi(target, name);
    }

    public static String glGetStringi(int name, int index) {
        return Shim.switches().extensions().get(index);
    }

    public static Buffer glMapBufferRange(int target, int offset, int length, int access) {
        long address = org.lwjgl.opengles.GLES30.nglMapBufferRange(target, offset, length, access);
        // As Android does, whatever the machine's own order is.
        return address == 0 ? null : MemoryUtil.memByteBuffer(address, length).order(ByteOrder.BIG_ENDIAN);
    }

    public static void glTexStorage2D(int target, int levels, int format, int width, int height) {
        org.lwjgl.opengles.GLES30.glTexStorage2D(target, levels, format, width, height);
    }

    public static void glUniform1uiv(int location, int count, int[] values, int offset) {
        org.lwjgl.opengles.GLES30.glUniform1uiv(location, Shim.part(values, offset, count));
    }

    public static void glUniform2uiv(int location, int count, int[] values, int offset) {
        org.lwjgl.opengles.GLES30.glUniform2uiv(location, Shim.part(values, offset, count * 2));
    }

    public static void glUniform4uiv(int location, int count, int[] values, int offset) {
        org.lwjgl.opengles.GLES30.glUniform4uiv(location, Shim.part(values, offset, count * 4));
    }

    public static boolean glUnmapBuffer(int target) {
        return org.lwjgl.opengles.GLES30.glUnmapBuffer(target);
    }

    public static void glVertexAttribIPointer(int index, int size, int type, int stride, int offset) {
        org.lwjgl.opengles.GLES30.glVertexAttribIPointer(index, size, type, stride, offset);
    }
}
