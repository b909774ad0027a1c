package org.rayfarm.desktop;

import java.io.BufferedReader;
import java.io.File;
import java.io.InputStreamReader;
import java.lang.reflect.Constructor;
import java.lang.reflect.InvocationHandler;
import java.lang.reflect.InvocationTargetException;
import java.lang.reflect.Method;
import java.lang.reflect.Proxy;
import java.util.HashMap;
import java.util.Iterator;
import java.util.Map;
import org.json.JSONArray;
import org.json.JSONObject;

/**
 * Several runs of the agent in one process, for tests. Each line of standard input is a JSON object of `env`, the shim's
 * switches, and of `args`, the agent's words, answered by a line with the exit code; or of `plan`, a file, answered by
 * what the agent reads in it; or of `certain`, two numbers for its timer. Nothing watches the caller.
 */
public final class Batch {
    private Batch() {
    }

    /** Run what standard input says until it ends. */
    public static void main(String[] words) throws Exception {
        BufferedReader lines = new BufferedReader(new InputStreamReader(System.in, "UTF-8"));
        for (String line = lines.readLine(); line != null; line = lines.readLine()) {
            JSONObject task = new JSONObject(line);
            Shim.switches(new Switches(strings(task.getJSONObject("env"))));
            System.out.println(answer(task));
            System.out.flush();
        }
        Runtime.getRuntime().halt(0);
    }

    private static Object answer(JSONObject task) throws Exception {
        if (task.has("certain")) {
            return certain(task.getJSONArray("certain"));
        }
        return task.has("plan") ? read(new File(task.getString("plan"))) : run(task);
    }

    /** What the agent reads in a plan's file, its sentence where it refuses, or that it fell over. */
    private static Object read(File path) throws Exception {
        try {
            return PlanDump.of(path);
        } catch (InvocationTargetException error) {
            Throwable cause = error.getCause();
            return (agent("AgentException").isInstance(cause) ? "error " : "fell " + cause.getClass() + " ")
                    + cause.getMessage();
        }
    }

    private static Object run(JSONObject task) throws Exception {
        JSONArray args = task.getJSONArray("args");
        String[] words = new String[args.length()];
        for (int i = 0; i < words.length; i++) {
            words[i] = args.getString(i);
        }
        // By reflection: the agent's classes are package-private, and from another jar.
        Class<?> phases = agent("Phases");
        InvocationHandler quiet = new InvocationHandler() {
            @Override
            public Object invoke(Object proxy, Method method, Object[] given) {
                return null;
            }
        };
        Object silent = Proxy.newProxyInstance(phases.getClassLoader(), new Class<?>[] {phases}, quiet);
        try {
            Object arguments = open(agent("Arguments"), String[].class, File.class).newInstance(words, null);
            Object session = open(agent("Session"), agent("Arguments"), phases).newInstance(arguments, silent);
            Method run = agent("Session").getDeclaredMethod("run");
            run.setAccessible(true);
            return run.invoke(session);
        } catch (InvocationTargetException error) {
            return "error " + error.getCause().getMessage();
        }
    }

    /** The agent's reading of a timer: 32 bits and the time to completion in nanoseconds. */
    private static Object certain(JSONArray numbers) throws Exception {
        Method certain = agent("GpuTimer").getDeclaredMethod("certain", long.class, long.class);
        certain.setAccessible(true);
        return certain.invoke(null, numbers.getLong(0), numbers.getLong(1));
    }

    static Class<?> agent(String name) throws ClassNotFoundException {
        return Class.forName("org.rayfarm.agent." + name);
    }

    static Constructor<?> open(Class<?> kind, Class<?>... takes) throws NoSuchMethodException {
        Constructor<?> constructor = kind.getDeclaredConstructor(takes);
        constructor.setAccessible(true);
        return constructor;
    }

    private static Map<String, String> strings(JSONObject object) throws Exception {
        Map<String, String> strings = new HashMap<String, String>();
        for (Iterator<String> names = object.keys(); names.hasNext();) {
            String name = names.next();
            strings.put(name, object.getString(name));
        }
        return strings;
    }
}
