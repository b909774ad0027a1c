package org.rayfarm.agent;

import java.io.File;
import java.io.IOException;
import java.io.RandomAccessFile;
import java.io.UnsupportedEncodingException;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import org.json.JSONArray;
import org.json.JSONException;
import org.json.JSONObject;

/** Counter files of the kernel, read after every frame into memory set aside beforehand. */
final class Samples {
    /** Bytes kept of one reading; counters are a line of a few numbers. */
    private static final int LIMIT = 96;

    private final List<Counter> counters = new ArrayList<Counter>();
    private final JSONObject unavailable = new JSONObject();
    private volatile int taken;

    private static final class Counter {
        final String name;
        final File path;
        final RandomAccessFile file;
        final byte[] bytes;
        final int[] lengths;

        Counter(String name, File path, int count) throws IOException {
            this.name = name;
            this.path = path;
            file = new RandomAccessFile(path, "r");
            bytes = new byte[count * LIMIT];
            lengths = new int[count];
            // Some counters open and then refuse to be read.
            file.read(new byte[1]);
        }
    }

    /** Open the files by class, for {@code count} readings of each. */
    Samples(Map<String, File> files, int count) throws JSONException {
        for (Map.Entry<String, File> entry : files.entrySet()) {
            try {
                counters.add(new Counter(entry.getKey(), entry.getValue(), count));
            } catch (IOException error) {
                unavailable.put(entry.getKey(), String.valueOf(error.getMessage()));
            }
        }
    }

    /** Read every counter once more. */
    void take() {
        int at = taken;
        for (int i = 0; i < counters.size(); i++) {
            Counter counter = counters.get(i);
            try {
                counter.file.seek(0);
                counter.lengths[at] = counter.file.read(counter.bytes, at * LIMIT, LIMIT);
            } catch (IOException error) {
                counter.lengths[at] = -1;
            }
        }
        taken = at + 1;
    }

    JSONObject json() throws JSONException {
        JSONObject all = new JSONObject();
        int count = taken;
        for (Counter counter : counters) {
            JSONArray values = new JSONArray();
            for (int i = 0; i < count; i++) {
                values.put(value(counter, i));
            }
            all.put(counter.name, new JSONObject().put("file", counter.path.getPath()).put("values", values));
        }
        return all;
    }

    /** Reasons by class. */
    JSONObject unavailable() {
        return unavailable;
    }

    private static Object value(Counter counter, int i) {
        int length = counter.lengths[i];
        if (length < 0) {
            return JSONObject.NULL;
        }
        try {
            return new String(counter.bytes, i * LIMIT, length, "UTF-8").trim();
        } catch (UnsupportedEncodingException error) {
            throw new IllegalStateException(error);
        }
    }
}
