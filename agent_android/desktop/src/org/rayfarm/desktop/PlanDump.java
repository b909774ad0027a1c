package org.rayfarm.desktop;

import java.io.File;
import java.lang.reflect.Array;
import java.lang.reflect.Field;
import java.lang.reflect.Method;
import java.lang.reflect.Modifier;
import java.nio.ByteBuffer;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import org.json.JSONArray;
import org.json.JSONObject;

/** Everything that the agent reads in a plan's file, for tests to compare. */
final class PlanDump {
    private PlanDump() {
    }

    /** The fields of the agent's Plan, with `data`: the bytes of each buffer and texture that has any. */
    static JSONObject of(File path) throws Exception {
        Object file = Batch.open(Batch.agent("PlanFile"), File.class).newInstance(path);
        Object plan = field(file, "plan");
        JSONObject dump = (JSONObject) dump(plan);
        Method read = file.getClass().getDeclaredMethod("data", Batch.agent("Plan$Buffer"));
        read.setAccessible(true);
        JSONObject data = new JSONObject();
        List<Object> held = new ArrayList<Object>((List<?>) field(plan, "buffers"));
        for (Object texture : ((Map<?, ?>) field(plan, "textures")).values()) {
            held.add(field(texture, "data"));
        }
        for (Object buffer : held) {
            if (buffer != null && (Long) field(buffer, "offset") >= 0) {
                data.put((String) field(buffer, "name"), bytes((ByteBuffer) read.invoke(file, buffer)));
            }
        }
        return dump.put("data", data);
    }

    private static JSONArray bytes(ByteBuffer buffer) {
        JSONArray all = new JSONArray();
        for (int i = 0; i < buffer.capacity(); i++) {
            all.put(buffer.get(i) & 255);
        }
        return all;
    }

    private static Object dump(Object value) throws Exception {
        if (value instanceof Map) {
            JSONObject object = new JSONObject();
            for (Map.Entry<?, ?> entry : ((Map<?, ?>) value).entrySet()) {
                object.put(String.valueOf(entry.getKey()), dump(entry.getValue()));
            }
            return object;
        }
        if (value instanceof Iterable || value != null && value.getClass().isArray()) {
            JSONArray array = new JSONArray();
            for (Object element : value instanceof Iterable ? (Iterable<?>) value : elements(value)) {
                array.put(dump(element));
            }
            return array;
        }
        return value != null && value.getClass().getName().startsWith("org.rayfarm.agent.") ? fields(value)
                : value == null ? JSONObject.NULL : value;
    }

    private static JSONObject fields(Object value) throws Exception {
        JSONObject object = new JSONObject();
        for (Field field : value.getClass().getDeclaredFields()) {
            if (!Modifier.isStatic(field.getModifiers())) {
                field.setAccessible(true);
                object.put(field.getName(), dump(field.get(value)));
            }
        }
        return object;
    }

    private static Iterable<Object> elements(Object array) {
        List<Object> all = new ArrayList<Object>();
        for (int i = 0; i < Array.getLength(array); i++) {
            all.add(Array.get(array, i));
        }
        return all;
    }

    private static Object field(Object object, String name) throws Exception {
        Field field = object.getClass().getDeclaredField(name);
        field.setAccessible(true);
        return field.get(object);
    }
}
