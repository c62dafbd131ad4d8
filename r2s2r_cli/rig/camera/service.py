"""The camera as a process sees it from outside: frames over TCP (docs/reference/protocols.md, section camera)."""
