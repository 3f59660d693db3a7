"""The bench file: what each signal of a log means, what is known to be wrong with it, and a first draft of one."""
