package android.os;

/** The saved state that a new activity does not have. */
public final class Bundle {
}
