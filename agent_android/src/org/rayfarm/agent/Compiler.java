package org.rayfarm.agent;

import android.opengl.GLES20;
import android.opengl.GLES31;
import java.util.Locale;
import java.util.Map;

/** Compiles and links programs. */
final class Compiler {
    private Compiler() {
    }

    /**
     * Make a program of texts by stage.
     *
     * @throws AgentException naming the program and the compiler's first error
     */
    static int program(String name, Map<String, String> stages) throws AgentException {
        int program = GLES20.glCreateProgram();
        for (Map.Entry<String, String> stage : stages.entrySet()) {
            int shader = GLES20.glCreateShader(kind(stage.getKey()));
            GLES20.glShaderSource(shader, stage.getValue());
            GLES20.glCompileShader(shader);
            int[] compiled = new int[1];
            GLES20.glGetShaderiv(shader, GLES20.GL_COMPILE_STATUS, compiled, 0);
            if (compiled[0] == 0) {
                throw failure(name, GLES20.glGetShaderInfoLog(shader));
            }
            GLES20.glAttachShader(program, shader);
            GLES20.glDeleteShader(shader);
        }
        GLES20.glLinkProgram(program);
        int[] linked = new int[1];
        GLES20.glGetProgramiv(program, GLES20.GL_LINK_STATUS, linked, 0);
        if (linked[0] == 0) {
            throw failure(name, GLES20.glGetProgramInfoLog(program));
        }
        return program;
    }

    private static int kind(String stage) throws AgentException {
        switch (stage) {
            case "vertex":
                return GLES20.GL_VERTEX_SHADER;
            case "fragment":
                return GLES20.GL_FRAGMENT_SHADER;
            case "compute":
                return GLES31.GL_COMPUTE_SHADER;
            default:
                throw AgentException.failed("The plan has a stage '" + stage + "' that this agent does not know.");
        }
    }

    private static AgentException failure(String name, String log) {
        String first = "the driver gives no reason";
        for (String line : (log == null ? "" : log).split("\n")) {
            if (line.toLowerCase(Locale.ROOT).contains("error") && line.contains(":")) {
                first = line.trim();
                break;
            }
        }
        return AgentException.failed("The program " + name + " does not compile on this device: " + first);
    }
}
