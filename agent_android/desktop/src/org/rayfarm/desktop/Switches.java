package org.rayfarm.desktop;

import java.lang.reflect.Field;
import java.util.ArrayList;
import java.util.HashMap;
import java.util.List;
import java.util.Map;
import org.lwjgl.opengles.GLES20;
import org.lwjgl.opengles.GLES32;

/** What the environment makes the stand-in device say or do; agent_android/README.md lists the switches. */
public final class Switches {
    private static final int GPU_DISJOINT = 0x8FBB;

    private final Map<Integer, Long> limits = new HashMap<Integer, Long>();
    private final String extensionsOff;
    private final boolean disjoint;
    private final long timerAddNs;
    private final int hangAt;
    private final List<String> extensions = new ArrayList<String>();
    private int finished;

    /** Read the environment's switches. */
    public Switches(Map<String, String> environment) {
        for (String entry : words(environment.get("RAYFARM_SHIM_LIMITS"))) {
            int equals = entry.indexOf('=');
            limits.put(constant("GL_" + entry.substring(0, equals)), Long.valueOf(entry.substring(equals + 1)));
        }
        extensionsOff = " " + text(environment, "RAYFARM_SHIM_EXTENSIONS_OFF").replace(',', ' ') + " ";
        disjoint = text(environment, "RAYFARM_SHIM_DISJOINT").equals("1");
        String add = text(environment, "RAYFARM_SHIM_TIMER_ADD_NS");
        timerAddNs = add.isEmpty() ? 0 : Long.parseLong(add);
        hangAt = hang(text(environment, "RAYFARM_SHIM_HANG"));
    }

    /** What glGetIntegerv and glGetInteger64v answer. */
    public long integer(int name, long answer) {
        if (name == GLES32.GL_NUM_EXTENSIONS) {
            return extensions().size();
        }
        if (name == GPU_DISJOINT) {
            return disjoint ? 1 : answer;
        }
        Long limit = limits.get(name);
        return limit == null ? answer : limit;
    }

    /** The extensions that are not switched off. */
    public List<String> extensions() {
        if (extensions.isEmpty()) {
            for (int i = 0; i < GLES20.glGetInteger(GLES32.GL_NUM_EXTENSIONS); i++) {
                String name = GLES32.glGetStringi(GLES20.GL_EXTENSIONS, i);
                if (!extensionsOff.contains(" " + name + " ")) {
                    extensions.add(name);
                }
            }
        }
        return extensions;
    }

    /** What 32 bits of a timer's nanoseconds hold. */
    public int timer(long nanoseconds) {
        return (int) (nanoseconds + timerAddNs);
    }

    /** Called before each glFinish; never returns from the one that is to hang. */
    public void finish() {
        while (++finished == hangAt) {
            try {
                Thread.sleep(Long.MAX_VALUE);
            } catch (InterruptedException error) {
                finished--;
            }
        }
    }

    /** `finish` hangs at the first call, `finish:3` at the third. */
    private static int hang(String text) {
        if (text.isEmpty()) {
            return 0;
        }
        String[] parts = text.split(":");
        if (!parts[0].equals("finish")) {
            throw new IllegalArgumentException("RAYFARM_SHIM_HANG is finish or finish:N");
        }
        return parts.length == 1 ? 1 : Integer.parseInt(parts[1]);
    }

    private static int constant(String name) {
        try {
            Field field = GLES32.class.getField(name);
            return field.getInt(null);
        } catch (ReflectiveOperationException error) {
            throw new IllegalArgumentException("RAYFARM_SHIM_LIMITS: there is no " + name);
        }
    }

    private static String text(Map<String, String> environment, String name) {
        String value = environment.get(name);
        return value == null ? "" : value;
    }

    private static String[] words(String list) {
        return list == null || list.isEmpty() ? new String[0] : list.split(",");
    }
}
