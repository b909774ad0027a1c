package org.rayfarm.agent;

import java.io.Closeable;
import java.io.File;
import java.io.IOException;
import java.io.RandomAccessFile;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.channels.FileChannel;
import java.util.Arrays;
import org.json.JSONException;
import org.json.JSONObject;

/** A plan's file: its header read, its data mapped one at a time so that none has to fit into the heap. */
final class PlanFile implements Closeable {
    private static final String MAGIC = "RAYFARM\0";
    private static final int VERSION = 3;
    private static final int HEAD = 48;

    final Plan plan;
    private final RandomAccessFile file;
    private final long base;

    /** Read the header; the sentences of the errors are those of renderer/plan.py. */
    PlanFile(File path) throws IOException, AgentException {
        if (!path.canRead()) {
            throw AgentException.failed("The plan " + path.getName() + " cannot be read.");
        }
        file = new RandomAccessFile(path, "r");
        try {
            byte[] text = header(path.getName());
            base = (long) HEAD + text.length;
            plan = new Plan(new JSONObject(new String(text, "UTF-8")));
        } catch (JSONException | RuntimeException | StackOverflowError error) {
            // Whole, and yet no header of a plan.
            close();
            throw torn(path.getName());
        } catch (AgentException | IOException error) {
            close();
            throw error;
        }
    }

    /** The bytes of a buffer or texture that has data, checked, to be read by the driver as they lie in the file. */
    ByteBuffer data(Plan.Buffer buffer) throws IOException, AgentException {
        long start = base + buffer.offset;
        ByteBuffer data = null;
        if (buffer.bytes == 0) {
            // Mapping nothing is an error on some systems.
            data = ByteBuffer.allocateDirect(0);
        } else if (buffer.offset >= 0 && buffer.bytes > 0 && buffer.bytes <= Integer.MAX_VALUE
                && buffer.offset <= file.length() - base - buffer.bytes) {
            data = file.getChannel().map(FileChannel.MapMode.READ_ONLY, start, buffer.bytes);
        }
        if (data == null || !Digests.of(data).equals(buffer.sha256)) {
            throw AgentException.failed("The plan's " + buffer.kind + " " + buffer.name
                    + " fails its checksum: the file is torn.");
        }
        return data.order(ByteOrder.LITTLE_ENDIAN);
    }

    @Override
    public void close() throws IOException {
        file.close();
    }

    private byte[] header(String name) throws IOException, AgentException {
        byte[] head = new byte[HEAD];
        if (file.length() < head.length) {
            throw AgentException.failed(name + " is not a RayFarm plan.");
        }
        file.readFully(head);
        if (!new String(head, 0, 8, "ISO-8859-1").equals(MAGIC)) {
            throw AgentException.failed(name + " is not a RayFarm plan.");
        }
        ByteBuffer numbers = ByteBuffer.wrap(head).order(ByteOrder.LITTLE_ENDIAN);
        int version = numbers.getInt(8);
        if (version != VERSION) {
            throw AgentException.failed(name + " is a plan of version " + version + "; this host reads version "
                    + VERSION + ".");
        }
        long length = numbers.getInt(12) & 0xFFFFFFFFL;
        if (HEAD + length > file.length() || length > Integer.MAX_VALUE - 8) {
            throw torn(name);
        }
        byte[] text = new byte[(int) length];
        file.readFully(text);
        if (!Arrays.equals(Digests.sha256().digest(text), Arrays.copyOfRange(head, 16, HEAD))) {
            throw torn(name);
        }
        return text;
    }

    private static AgentException torn(String name) {
        return AgentException.failed(name + " is torn: its header cannot be read.");
    }
}
