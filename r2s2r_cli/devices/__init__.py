"""What stages know of devices: Protocols and values (ADR 10). `hardware` implements them, `commands` hand them over.

Nothing here touches a port; numpy and the standard library only.
"""
