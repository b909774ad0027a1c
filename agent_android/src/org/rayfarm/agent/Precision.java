package org.rayfarm.agent;

import android.opengl.GLES20;
import android.opengl.GLES30;
import android.opengl.GLES31;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.IntBuffer;
import java.util.HashMap;
import java.util.Map;
import org.json.JSONException;
import org.json.JSONObject;

/** How exactly the device computes: each operation on the same cases, in a compute and in a fragment shader. */
final class Precision {
    private final PrecisionCases cases = new PrecisionCases();

    /** By stage: by operation, what PrecisionCases says of the answers; or `error` where the stage did not run. */
    JSONObject json() throws JSONException {
        JSONObject stages = new JSONObject();
        for (String stage : new String[] {"compute", "fragment"}) {
            JSONObject found;
            try {
                found = cases.judge(stage.equals("compute") ? compute() : fragment());
            } catch (AgentException error) {
                found = new JSONObject().put("error", error.getMessage());
            }
            stages.put(stage, found);
        }
        return stages;
    }

    private int[] compute() throws AgentException {
        int program = program("compute", PrecisionText.compute());
        int[] buffer = new int[1];
        int bytes = PrecisionCases.OPERATIONS.length * PrecisionCases.COUNT * 4;
        int target = GLES31.GL_SHADER_STORAGE_BUFFER;
        GLES20.glGenBuffers(1, buffer, 0);
        GLES30.glBindBufferBase(target, 0, buffer[0]);
        GLES20.glBufferData(target, bytes, null, GLES30.GL_DYNAMIC_READ);
        use(program);
        GLES31.glDispatchCompute(PrecisionCases.COUNT / 8, PrecisionCases.OPERATIONS.length, 1);
        GLES31.glMemoryBarrier(GLES31.GL_ALL_BARRIER_BITS);
        GLES20.glFinish();
        ByteBuffer mapped = (ByteBuffer) GLES30.glMapBufferRange(target, 0, bytes, GLES30.GL_MAP_READ_BIT);
        Gl.check("probing precision in a compute shader");
        int[] answers = words(mapped, 1);
        GLES30.glUnmapBuffer(target);
        return answers;
    }

    private int[] fragment() throws AgentException {
        int program = program("fragment", PrecisionText.fragment());
        int width = PrecisionCases.COUNT;
        int height = PrecisionCases.OPERATIONS.length;
        int[] made = new int[1];
        GLES20.glGenTextures(1, made, 0);
        GLES20.glBindTexture(GLES20.GL_TEXTURE_2D, made[0]);
        GLES30.glTexStorage2D(GLES20.GL_TEXTURE_2D, 1, GLES30.GL_R32UI, width, height);
        int texture = made[0];
        GLES20.glGenFramebuffers(1, made, 0);
        GLES20.glBindFramebuffer(GLES20.GL_FRAMEBUFFER, made[0]);
        GLES20.glFramebufferTexture2D(GLES20.GL_FRAMEBUFFER, GLES20.GL_COLOR_ATTACHMENT0, GLES20.GL_TEXTURE_2D,
                texture, 0);
        GLES20.glViewport(0, 0, width, height);
        use(program);
        GLES20.glDrawArrays(GLES20.GL_TRIANGLES, 0, 3);
        ByteBuffer pixels = ByteBuffer.allocateDirect(width * height * 16);
        GLES20.glReadPixels(0, 0, width, height, GLES30.GL_RGBA_INTEGER, GLES20.GL_UNSIGNED_INT, pixels);
        Gl.check("probing precision in a fragment shader");
        return words(pixels, 4);
    }

    private static int program(String stage, String text) throws AgentException {
        Map<String, String> stages = new HashMap<String, String>();
        stages.put(stage, text);
        if (stage.equals("fragment")) {
            stages.put("vertex", PrecisionText.VERTEX);
        }
        return Compiler.program("precision-" + stage, stages);
    }

    private void use(int program) {
        GLES20.glUseProgram(program);
        int location = GLES20.glGetUniformLocation(program, "cases");
        GLES30.glUniform4uiv(location, PrecisionCases.COUNT, cases.words(), 0);
    }

    /** Every {@code stride}-th word. */
    private static int[] words(ByteBuffer bytes, int stride) {
        IntBuffer words = bytes.order(ByteOrder.LITTLE_ENDIAN).asIntBuffer();
        int[] found = new int[PrecisionCases.OPERATIONS.length * PrecisionCases.COUNT];
        for (int i = 0; i < found.length; i++) {
            found[i] = words.get(i * stride);
        }
        return found;
    }
}
