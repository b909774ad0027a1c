"""Compiles plans for phone GPUs with Mesa's own compilers, no phone needed, and weighs what comes out: an estimate."""
