"""The command ``loco-drake``.

The comment above a field of a command is the help of its option: of a docstring below
it, tyro would keep the line breaks. Each further line begins with a letter.
"""
