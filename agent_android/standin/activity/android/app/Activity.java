package android.app;

import android.content.Intent;
import android.os.Bundle;
import android.view.Window;
import java.io.File;

/** As much of an activity as the agent's needs: its intent, its folder, its window, and its end. */
public class Activity {
    private Intent intent;
    private File files;

    /** Called once by the stand-in before {@link #onCreate}. */
    public final void attach(Intent started, File folder) {
        intent = started;
        files = folder;
    }

    /** What it was started with. */
    public Intent getIntent() {
        return intent;
    }

    /** The app's own folder. */
    public File getFilesDir() {
        return files;
    }

    /** A window that takes flags. */
    public Window getWindow() {
        return new Window();
    }

    /** No configuration changes here. */
    public boolean isChangingConfigurations() {
        return false;
    }

    /** Ends the activity; the process goes on. */
    public void finish() {
    }

    /** For the subclass. */
    protected void onCreate(Bundle saved) {
    }

    /** For the subclass. */
    protected void onDestroy() {
    }
}
