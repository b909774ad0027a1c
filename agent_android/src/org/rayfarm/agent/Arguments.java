package org.rayfarm.agent;

import java.io.File;
import java.util.LinkedHashMap;
import java.util.Map;

/** The command line, as README.md has it. */
final class Arguments {
    private static final String USAGE = "see agent_android/README.md for the command line.";

    final boolean probe;
    final String version;
    final String token;
    final File out;
    final double deadlineSeconds;
    final File plan;
    final int frames;
    final int warmUp;
    /** Counter files by class. */
    final Map<String, File> samples = new LinkedHashMap<String, File>();

    private final File folder;

    /**
     * Read the words of a command line; paths are taken from {@code folder} unless absolute.
     *
     * @throws AgentException for a missing, unknown or unreadable option, with a sentence
     */
    Arguments(String[] words, File folder) throws AgentException {
        this.folder = folder;
        Map<String, String> given = new LinkedHashMap<String, String>();
        for (int i = 1; i < words.length; i += 2) {
            if (i + 1 == words.length) {
                throw AgentException.failed("The option " + words[i] + " has no value: " + USAGE);
            }
            if (words[i].equals("--sample")) {
                addSample(words[i + 1]);
            } else {
                given.put(words[i], words[i + 1]);
            }
        }
        String verb = words.length == 0 ? "" : words[0];
        probe = verb.equals("probe");
        if (!probe && !verb.equals("run")) {
            throw AgentException.failed("There is no verb '" + verb + "': " + USAGE);
        }
        version = take(given, "--version");
        token = take(given, "--token");
        out = file(take(given, "--out"));
        deadlineSeconds = number(given, "--deadline", 0.001, 1e6);
        plan = probe ? null : file(take(given, "--plan"));
        frames = probe ? 0 : (int) number(given, "--frames", 0, 1e6);
        warmUp = probe ? 0 : (int) number(given, "--warm-up", 0, 1e6);
        if (!given.isEmpty()) {
            throw AgentException.failed("There is no option " + given.keySet().iterator().next() + ": " + USAGE);
        }
    }

    private void addSample(String text) throws AgentException {
        int equals = text.indexOf('=');
        if (equals < 1) {
            throw AgentException.failed("The sample '" + text + "' is not CLASS=FILE: " + USAGE);
        }
        samples.put(text.substring(0, equals), file(text.substring(equals + 1)));
    }

    private File file(String path) {
        File named = new File(path);
        return folder == null || named.isAbsolute() ? named : new File(folder, path);
    }

    private static String take(Map<String, String> given, String option) throws AgentException {
        String value = given.remove(option);
        if (value == null) {
            throw AgentException.failed("The option " + option + " is missing: " + USAGE);
        }
        return value;
    }

    private static double number(Map<String, String> given, String option, double least, double most)
            throws AgentException {
        String text = take(given, option);
        try {
            double value = Double.parseDouble(text);
            if (value >= least && value <= most) {
                return value;
            }
        } catch (NumberFormatException error) {
            // Said below, as for a number out of range.
        }
        throw AgentException.failed("The value '" + text + "' of " + option + " is out of range: " + USAGE);
    }
}
