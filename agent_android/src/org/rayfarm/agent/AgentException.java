package org.rayfarm.agent;

/** Why a run ended without a measurement: its outcome in the record, and one sentence for the user. */
final class AgentException extends Exception {
    private static final long serialVersionUID = 1;

    static final String DONE = "done";
    static final String REFUSED = "refused";
    static final String FAILED = "failed";
    static final String DEADLINE = "deadline";

    final String outcome;

    private AgentException(String outcome, String sentence) {
        super(sentence);
        this.outcome = outcome;
    }

    /** What this device or this agent cannot run, said before anything is uploaded. */
    static AgentException refused(String sentence) {
        return new AgentException(REFUSED, sentence);
    }

    /** What went wrong on the way. */
    static AgentException failed(String sentence) {
        return new AgentException(FAILED, sentence);
    }
}
