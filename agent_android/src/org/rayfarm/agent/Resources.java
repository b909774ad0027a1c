package org.rayfarm.agent;

import android.opengl.GLES20;
import android.opengl.GLES30;
import android.opengl.GLES31;
import java.nio.ByteBuffer;
import java.util.HashMap;
import java.util.List;
import java.util.Map;

/** A plan's programs, buffers and textures on the current context, which frees them when it is closed. */
final class Resources {
    private static final int LEAST_BYTES = 16;
    private static final int CHUNK = 8 << 20;

    final Map<String, Integer> programs = new HashMap<String, Integer>();
    final Map<String, Integer> buffers = new HashMap<String, Integer>();
    final Map<String, Integer> textures = new HashMap<String, Integer>();
    private final Plan plan;

    Resources(Plan plan) {
        this.plan = plan;
    }

    void compile() throws AgentException {
        for (Map.Entry<String, Map<String, String>> program : plan.programs.entrySet()) {
            programs.put(program.getKey(), Compiler.program(program.getKey(), program.getValue()));
        }
    }

    void upload(PlanFile file) throws Exception {
        for (Plan.Buffer buffer : plan.buffers) {
            buffers.put(buffer.name, upload(buffer, buffer.offset < 0 ? null : file.data(buffer)));
            Gl.check("uploading the buffer " + buffer.name + " of " + buffer.bytes + " bytes");
        }
        for (Map.Entry<String, Plan.Texture> entry : plan.textures.entrySet()) {
            Plan.Texture texture = entry.getValue();
            textures.put(entry.getKey(), texture.data == null ? texture(texture.format, plan.width, plan.height)
                    : filled(texture, file.data(texture.data)));
            Gl.check("making the texture " + entry.getKey());
        }
    }

    /** The bytes of a buffer as the device holds it. */
    static int held(Plan.Buffer buffer) {
        return (int) Math.max(buffer.bytes, LEAST_BYTES);
    }

    /** A framebuffer of a colour texture and, if there are two names, a depth texture. */
    int framebuffer(List<String> names) throws AgentException {
        int[] made = new int[1];
        GLES20.glGenFramebuffers(1, made, 0);
        GLES20.glBindFramebuffer(GLES20.GL_FRAMEBUFFER, made[0]);
        attach(GLES20.GL_COLOR_ATTACHMENT0, names.get(0));
        if (names.size() > 1) {
            attach(GLES20.GL_DEPTH_ATTACHMENT, names.get(1));
        }
        if (!Gl.complete()) {
            throw AgentException.failed("This device cannot draw into " + names + ".");
        }
        return made[0];
    }

    static int internalFormat(String format) {
        switch (format) {
            case "rgba8":
                return GLES30.GL_RGBA8;
            case "r32ui":
                return GLES30.GL_R32UI;
            case "depth24":
                return GLES30.GL_DEPTH_COMPONENT24;
            case "rgba32ui":
                return GLES30.GL_RGBA32UI;
            default:
                throw new IllegalArgumentException("no texture format " + format);
        }
    }

    private void attach(int point, String name) {
        GLES20.glFramebufferTexture2D(GLES20.GL_FRAMEBUFFER, point, GLES20.GL_TEXTURE_2D, textures.get(name), 0);
    }

    private static int upload(Plan.Buffer buffer, ByteBuffer data) throws AgentException {
        if (buffer.bytes > Integer.MAX_VALUE) {
            throw AgentException.refused("The buffer " + buffer.name + " has " + buffer.bytes
                    + " bytes; the agent takes " + Integer.MAX_VALUE + ".");
        }
        int[] made = new int[1];
        GLES20.glGenBuffers(1, made, 0);
        int target = GLES31.GL_SHADER_STORAGE_BUFFER;
        GLES20.glBindBuffer(target, made[0]);
        GLES20.glBufferData(target, held(buffer), null, GLES20.GL_STATIC_DRAW);
        // In chunks: drivers stage what they are handed.
        for (int at = 0; data != null && at < data.capacity(); at += CHUNK) {
            int count = Math.min(CHUNK, data.capacity() - at);
            data.limit(at + count).position(at);
            GLES20.glBufferSubData(target, at, count, data.slice());
        }
        return made[0];
    }

    /** A texture of data, handed over in rows, of which the last may be a part. */
    private static int filled(Plan.Texture texture, ByteBuffer data) {
        int made = texture(texture.format, texture.width, (int) texture.rows());
        int row = texture.width * Plan.Texture.TEXEL_BYTES;
        int at = 0;
        while (at < data.capacity()) {
            int left = data.capacity() - at;
            int width = Math.min(left, row) / Plan.Texture.TEXEL_BYTES;
            int height = Math.max(Math.min(left, CHUNK) / row, 1);
            int count = width * height * Plan.Texture.TEXEL_BYTES;
            data.limit(at + count).position(at);
            GLES20.glTexSubImage2D(GLES20.GL_TEXTURE_2D, 0, 0, at / row, width, height, GLES30.GL_RGBA_INTEGER,
                    GLES20.GL_UNSIGNED_INT, data.slice());
            at += count;
        }
        return made;
    }

    private static int texture(String format, int width, int height) {
        int[] made = new int[1];
        GLES20.glGenTextures(1, made, 0);
        int target = GLES20.GL_TEXTURE_2D;
        GLES20.glBindTexture(target, made[0]);
        GLES30.glTexStorage2D(target, 1, internalFormat(format), width, height);
        GLES20.glTexParameteri(target, GLES20.GL_TEXTURE_MIN_FILTER, GLES20.GL_NEAREST);
        GLES20.glTexParameteri(target, GLES20.GL_TEXTURE_MAG_FILTER, GLES20.GL_NEAREST);
        return made[0];
    }
}
