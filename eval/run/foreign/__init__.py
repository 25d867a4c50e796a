"""Agents that are not this package's, each in a process of its own, so that nothing they do reaches anything but them.

The world stays with the runner (`host`). What crosses over (`wire`) is what an agent may know: observations one way,
actions the other; its model and its understanding are asked for it on the runner's side. A crash, `sys.exit`,
`os._exit`, a changed working directory or a thread that never ends is that episode's, and what the agent prints goes to
standard error (`guest`).
"""
