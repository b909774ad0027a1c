"""A model of the ALU work of a plan's tracing program: operations by block of its SPIR-V times executions."""
