package org.rayfarm.agent;

/** Where a run tells how far it is. */
interface Phases {
    void say(String phase);
}
