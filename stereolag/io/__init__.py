"""Files: one module a family of formats, which reads and writes it.

A reader takes a path, bytes or a binary file object, checks its size before decoding anything, and returns checked
arrays or raises a ``ValueError`` of one clear sentence. It writes nothing, runs nothing and emits no warnings; the text
that it quotes from a file in an error is short and harmless. A writer returns bytes or text without touching the disk;
only functions named ``write_`` write a file, whole or not at all.
"""
