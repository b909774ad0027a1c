package android.content;

import java.util.HashMap;
import java.util.Map;

/** The string arrays that `am start --esa` gave. */
public class Intent {
    private final Map<String, String[]> arrays = new HashMap<String, String[]>();

    /** Keep an array. */
    public Intent putExtra(String name, String[] value) {
        arrays.put(name, value);
        return this;
    }

    /** An array, or null. */
    public String[] getStringArrayExtra(String name) {
        return arrays.get(name);
    }
}
