/** Says its arguments, one a line, then waits for the end of its standard input. hello.jar is this, by javac and dx. */
public final class Hello {
    private Hello() {
    }

    /** Writes to standard output; the end mark comes after standard input's end. */
    public static void main(String[] arguments) throws java.io.IOException {
        for (int i = 0; i < arguments.length; i++) {
            System.out.println("argument " + arguments[i]);
        }
        System.out.println("ready " + System.getenv("HELLO"));
        while (System.in.read() >= 0) {
        }
        System.out.println("end of input");
    }
}
