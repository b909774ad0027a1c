package org.rayfarm.agent;

import android.opengl.GLES20;
import android.opengl.GLES30;
import android.opengl.GLES31;
import java.util.Map;
import java.util.TreeMap;

/** The device's limits by GL name without `GL_MAX_`, and the check of a plan against them. */
final class Limits {
    private final Map<String, Long> offered = new TreeMap<String, Long>();

    /** Ask the current context. */
    Limits() {
        ask("TEXTURE_SIZE", GLES20.GL_MAX_TEXTURE_SIZE);
        ask("RENDERBUFFER_SIZE", GLES20.GL_MAX_RENDERBUFFER_SIZE);
        ask("TEXTURE_IMAGE_UNITS", GLES20.GL_MAX_TEXTURE_IMAGE_UNITS);
        ask("VERTEX_ATTRIBS", GLES20.GL_MAX_VERTEX_ATTRIBS);
        ask("COLOR_ATTACHMENTS", GLES30.GL_MAX_COLOR_ATTACHMENTS);
        ask("DRAW_BUFFERS", GLES30.GL_MAX_DRAW_BUFFERS);
        ask("UNIFORM_BLOCK_SIZE", GLES30.GL_MAX_UNIFORM_BLOCK_SIZE);
        ask("FRAGMENT_UNIFORM_VECTORS", GLES20.GL_MAX_FRAGMENT_UNIFORM_VECTORS);
        ask("FRAGMENT_UNIFORM_COMPONENTS", GLES30.GL_MAX_FRAGMENT_UNIFORM_COMPONENTS);
        ask("COMPUTE_UNIFORM_COMPONENTS", GLES31.GL_MAX_COMPUTE_UNIFORM_COMPONENTS);
        ask("VERTEX_SHADER_STORAGE_BLOCKS", GLES31.GL_MAX_VERTEX_SHADER_STORAGE_BLOCKS);
        ask("FRAGMENT_SHADER_STORAGE_BLOCKS", GLES31.GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS);
        ask("COMPUTE_SHADER_STORAGE_BLOCKS", GLES31.GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS);
        ask("COMBINED_SHADER_STORAGE_BLOCKS", GLES31.GL_MAX_COMBINED_SHADER_STORAGE_BLOCKS);
        ask("SHADER_STORAGE_BUFFER_BINDINGS", GLES31.GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS);
        ask("SHADER_STORAGE_BLOCK_SIZE", GLES31.GL_MAX_SHADER_STORAGE_BLOCK_SIZE);
        ask("FRAGMENT_IMAGE_UNIFORMS", GLES31.GL_MAX_FRAGMENT_IMAGE_UNIFORMS);
        ask("COMPUTE_IMAGE_UNIFORMS", GLES31.GL_MAX_COMPUTE_IMAGE_UNIFORMS);
        ask("COMPUTE_TEXTURE_IMAGE_UNITS", GLES31.GL_MAX_COMPUTE_TEXTURE_IMAGE_UNITS);
        ask("IMAGE_UNITS", GLES31.GL_MAX_IMAGE_UNITS);
        ask("COMPUTE_WORK_GROUP_INVOCATIONS", GLES31.GL_MAX_COMPUTE_WORK_GROUP_INVOCATIONS);
        ask("COMPUTE_SHARED_MEMORY_SIZE", GLES31.GL_MAX_COMPUTE_SHARED_MEMORY_SIZE);
        ask("FRAMEBUFFER_WIDTH", GLES31.GL_MAX_FRAMEBUFFER_WIDTH);
        ask("FRAMEBUFFER_HEIGHT", GLES31.GL_MAX_FRAMEBUFFER_HEIGHT);
    }

    Map<String, Long> offered() {
        return offered;
    }

    /**
     * Check what a plan names, and what its size and its bindings imply.
     *
     * @throws AgentException refused, naming the limit, what is needed and what the device has
     */
    void check(Plan plan) throws AgentException {
        for (Map.Entry<String, Long> need : plan.needs.entrySet()) {
            check(need.getKey(), need.getValue());
        }
        check("TEXTURE_SIZE", Math.max(plan.width, plan.height));
        for (Plan.Texture texture : plan.textures.values()) {
            if (texture.data != null) {
                check("TEXTURE_SIZE", Math.max(texture.width, texture.rows()));
            }
        }
        for (Plan.Pass pass : plan.passes) {
            for (int binding : pass.storage.keySet()) {
                check("SHADER_STORAGE_BUFFER_BINDINGS", binding + 1);
            }
        }
    }

    private void check(String name, long needed) throws AgentException {
        Long has = offered.get(name);
        if (has == null) {
            throw AgentException.refused("The plan needs GL_MAX_" + name + " = " + needed
                    + ", a limit that this agent does not know.");
        }
        if (needed > has) {
            throw AgentException.refused("This device offers GL_MAX_" + name + " = " + has + "; the plan needs "
                    + needed + ".");
        }
    }

    private void ask(String name, int limit) {
        // 64 bits: some devices offer storage blocks of 2 GiB.
        long[] value = new long[1];
        GLES30.glGetInteger64v(limit, value, 0);
        offered.put(name, value[0]);
    }
}
