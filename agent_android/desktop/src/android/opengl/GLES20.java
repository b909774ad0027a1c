package android.opengl;

import java.nio.Buffer;
import org.rayfarm.desktop.Shim;

/** Stands in for Android's class on the desktop, as far as the agent calls it. */
public class GLES20 {
    public static void glActiveTexture(int texture) {
        org.lwjgl.opengles.GLES20.glActiveTexture(texture);
    }

    public static void glAttachShader(int program, int shader) {
        org.lwjgl.opengles.GLES20.glAttachShader(program, shader);
    }

    public static void glBindBuffer(int target, int buffer) {
        org.lwjgl.opengles.GLES20.glBindBuffer(target, buffer);
    }

    public static void glBindFramebuffer(int target, int framebuffer) {
        org.lwjgl.opengles.GLES20.glBindFramebuffer(target, framebuffer);
    }

    public static void glBindTexture(int target, int texture) {
        org.lwjgl.opengles.GLES20.glBindTexture(target, texture);
    }

    public static void glBufferData(int target, int size, Buffer data, int usage) {
        org.lwjgl.opengles.GLES20.nglBufferData(target, size, Shim.address(data), usage);
    }

    public static void glBufferSubData(int target, int offset, int size, Buffer data) {
        org.lwjgl.opengles.GLES20.nglBufferSubData(target, offset, size, Shim.address(data));
    }

    public static int glCheckFramebufferStatus(int target) {
        return org.lwjgl.opengles.GLES20.glCheckFramebufferStatus(target);
    }

    public static void glCompileShader(int shader) {
        org.lwjgl.opengles.GLES20.glCompileShader(shader);
    }

    public static int glCreateProgram() {
        return org.lwjgl.opengles.GLES20.glCreateProgram();
    }

    public static int glCreateShader(int type) {
        return org.lwjgl.opengles.GLES20.glCreateShader(type);
    }

    public static void glDeleteShader(int shader) {
        org.lwjgl.opengles.GLES20.glDeleteShader(shader);
    }

    public static void glDisable(int capability) {
        org.lwjgl.opengles.GLES20.glDisable(capability);
    }

    public static void glDrawArrays(int mode, int first, int count) {
        org.lwjgl.opengles.GLES20.glDrawArrays(mode, first, count);
    }

    public static void glEnable(int capability) {
        org.lwjgl.opengles.GLES20.glEnable(capability);
    }

    public static void glEnableVertexAttribArray(int index) {
        org.lwjgl.opengles.GLES20.glEnableVertexAttribArray(index);
    }

    public static void glFinish() {
        Shim.switches().finish();
        org.lwjgl.opengles.GLES20.glFinish();
    }

    public static void glFlush() {
        org.lwjgl.opengles.GLES20.glFlush();
    }

    public static void glFramebufferTexture2D(int target, int attachment, int kind, int texture, int level) {
        org.lwjgl.opengles.GLES20.glFramebufferTexture2D(target, attachment, kind, texture, level);
    }

    public static void glGenBuffers(int n, int[] buffers, int offset) {
        int[] made = new int[n];
        org.lwjgl.opengles.GLES20.glGenBuffers(made);
        Shim.put(made, buffers, offset);
    }

    public static void glGenFramebuffers(int n, int[] framebuffers, int offset) {
        int[] made = new int[n];
        org.lwjgl.opengles.GLES20.glGenFramebuffers(made);
        Shim.put(made, framebuffers, offset);
    }

    public static void glGenTextures(int n, int[] textures, int offset) {
        int[] made = new int[n];
        org.lwjgl.opengles.GLES20.glGenTextures(made);
        Shim.put(made, textures, offset);
    }

    public static int glGetAttribLocation(int program, String name) {
        return org.lwjgl.opengles.GLES20.glGetAttribLocation(program, name);
    }

    public static int glGetError() {
        return org.lwjgl.opengles.GLES20.glGetError();
    }

    public static void glGetIntegerv(int name, int[] params, int offset) {
        int answer = org.lwjgl.opengles.GLES20.glGetInteger(name);
        params[offset] = (int) Math.min(Shim.switches().integer(name, answer), Integer.MAX_VALUE);
    }

    public static String glGetProgramInfoLog(int program) {
        return org.lwjgl.opengles.GLES20.glGetProgramInfoLog(program);
    }

    public static void glGetProgramiv(int program, int name, int[] params, int offset) {
        params[offset] = org.lwjgl.opengles.GLES20.glGetProgrami(program, name);
    }

    public static String glGetShaderInfoLog(int shader) {
        return org.lwjgl.opengles.GLES20.glGetShaderInfoLog(shader);
    }

    public static void glGetShaderiv(int shader, int name, int[] params, int offset) {
        params[offset] = org.lwjgl.opengles.GLES20.glGetShaderi(shader, name);
    }

    public static String glGetString(int name) {
        return org.lwjgl.opengles.GLES20.glGetString(name);
    }

    public static int glGetUniformLocation(int program, String name) {
        return org.lwjgl.opengles.GLES20.glGetUniformLocation(program, name);
    }

    public static void glLinkProgram(int program) {
        org.lwjgl.opengles.GLES20.glLinkProgram(program);
    }

    public static void glReadPixels(int x, int y, int width, int height, int format, int type, Buffer pixels) {
        org.lwjgl.opengles.GLES20.nglReadPixels(x, y, width, height, format, type, Shim.address(pixels));
    }

    public static void glScissor(int x, int y, int width, int height) {
        org.lwjgl.opengles.GLES20.glScissor(x, y, width, height);
    }

    public static void glShaderSource(int shader, String text) {
        org.lwjgl.opengles.GLES20.glShaderSource(shader, text);
    }

    public static void glTexParameteri(int target, int name, int value) {
        org.lwjgl.opengles.GLES20.glTexParameteri(target, name, value);
    }

    public static void glTexSubImage2D(int target, int level, int x, int y, int width, int height, int format, int type,
            Buffer pixels) {
        org.lwjgl.opengles.GLES20.nglTexSubImage2D(target, level, x, y, width, height, format, type,
                Shim.address(pixels));
    }

    public static void glUniform1fv(int location, int count, float[] values, int offset) {
        org.lwjgl.opengles.GLES20.glUniform1fv(location, Shim.part(values, offset, count));
    }

    public static void glUniform1i(int location, int value) {
        org.lwjgl.opengles.GLES20.glUniform1i(location, value);
    }

    public static void glUniform1iv(int location, int count, int[] values, int offset) {
        org.lwjgl.opengles.GLES20.glUniform1iv(location, Shim.part(values, offset, count));
    }

    public static void glUniform2fv(int location, int count, float[] values, int offset) {
        org.lwjgl.opengles.GLES20.glUniform2fv(location, Shim.part(values, offset, count * 2));
    }

    public static void glUniform2i(int location, int x, int y) {
        org.lwjgl.opengles.GLES20.glUniform2i(location, x, y);
    }

    public static void glUniform2iv(int location, int count, int[] values, int offset) {
        org.lwjgl.opengles.GLES20.glUniform2iv(location, Shim.part(values, offset, count * 2));
    }

    public static void glUniform3fv(int location, int count, float[] values, int offset) {
        org.lwjgl.opengles.GLES20.glUniform3fv(location, Shim.part(values, offset, count * 3));
    }

    public static void glUniformMatrix4fv(int location, int count, boolean transpose, float[] values, int offset) {
        org.lwjgl.opengles.GLES20.glUniformMatrix4fv(location, transpose, Shim.part(values, offset, count * 16));
    }

    public static void glUseProgram(int program) {
        org.lwjgl.opengles.GLES20.glUseProgram(program);
    }

    public static void glVertexAttribPointer(int index, int size, int type, boolean normalised, int stride,
            int offset) {
        org.lwjgl.opengles.GLES20.glVertexAttribPointer(index, size, type, normalised, stride, offset);
    }

    public static void glViewport(int x, int y, int width, int height) {
        org.lwjgl.opengles.GLES20.glViewport(x, y, width, height);
    }
}
