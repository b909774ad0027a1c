package org.rayfarm.standin;

import android.app.Activity;
import android.content.Intent;
import android.os.Bundle;
import java.io.File;
import java.lang.reflect.Method;

/** Starts an activity: ActivityMain CLASS FILES-FOLDER [NAME WORD,WORD,...]. */
public final class ActivityMain {
    private ActivityMain() {
    }

    /** Returns when the activity is created; its threads go on. */
    public static void main(String[] arguments) throws ReflectiveOperationException {
        Intent intent = new Intent();
        if (arguments.length == 4) {
            intent.putExtra(arguments[2], arguments[3].split(",", -1));
        }
        Activity activity = (Activity) Class.forName(arguments[0]).getDeclaredConstructor().newInstance();
        activity.attach(intent, new File(arguments[1]));
        Method create = activity.getClass().getDeclaredMethod("onCreate", Bundle.class);
        create.setAccessible(true);
        create.invoke(activity, new Object[] {null});
    }
}
