package org.rayfarm.agent;

import java.io.File;
import java.io.FileOutputStream;
import java.io.IOException;
import java.nio.ByteBuffer;
import java.nio.channels.FileChannel;
import org.json.JSONArray;
import org.json.JSONException;
import org.json.JSONObject;

/** What was read back, kept in a file of its own until the record's header is known: it need not fit into the heap. */
final class Blobs {
    private static final int ALIGN = 16;

    private final File file;
    private final JSONArray entries = new JSONArray();
    private long offset;

    Blobs(File file) {
        this.file = file;
    }

    /** Append all that remains of {@code bytes} as one blob of a rectangle of pixels. */
    void append(String name, int x, int y, int width, int height, ByteBuffer bytes) throws IOException, JSONException {
        int count = bytes.remaining();
        JSONObject entry = new JSONObject();
        entry.put("name", name).put("x", x).put("y", y).put("width", width).put("height", height);
        entry.put("offset", offset).put("bytes", count).put("sha256", Digests.of(bytes));
        entries.put(entry);
        int padding = -count & (ALIGN - 1);
        FileOutputStream out = new FileOutputStream(file, true);
        try {
            FileChannel channel = out.getChannel();
            for (ByteBuffer part : new ByteBuffer[] {bytes.duplicate(), ByteBuffer.allocate(padding)}) {
                while (part.hasRemaining()) {
                    channel.write(part);
                }
            }
        } finally {
            out.close();
        }
        offset += count + padding;
    }

    /** The file of all blobs, or null if there is none. */
    File file() {
        return offset == 0 ? null : file;
    }

    JSONArray json() {
        return entries;
    }

    void remove() {
        file.delete();
    }
}
