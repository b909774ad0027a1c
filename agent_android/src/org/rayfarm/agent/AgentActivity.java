package org.rayfarm.agent;

import android.app.Activity;
import android.os.Bundle;
import android.util.Log;
import android.view.WindowManager;

/**
 * The second way in, for phones whose shell may not make a context: the words of the command line come as the string
 * array `args`, paths are taken from the app's own folder, phases go to the log, and the process ends with the run.
 */
public final class AgentActivity extends Activity {
    private static final String TAG = "rayfarm";

    @Override
    protected void onCreate(Bundle saved) {
        super.onCreate(saved);
        getWindow().addFlags(WindowManager.LayoutParams.FLAG_KEEP_SCREEN_ON);
        final String[] words = getIntent().getStringArrayExtra("args");
        new Thread("agent") {
            @Override
            public void run() {
                int code = run(words == null ? new String[0] : words);
                finish();
                Exit.now(code);
            }

            private int run(String[] given) {
                try {
                    return new Session(new Arguments(given, getFilesDir()), log()).run();
                } catch (AgentException error) {
                    Log.e(TAG, error.getMessage());
                    return Main.USAGE;
                }
            }
        }.start();
    }

    @Override
    protected void onDestroy() {
        super.onDestroy();
        if (!isChangingConfigurations()) {
            Exit.now(Main.CALLER_GONE);
        }
    }

    private static Phases log() {
        return new Phases() {
            @Override
            public void say(String phase) {
                Log.i(TAG, phase);
            }
        };
    }
}
