"""The command ``loco-drake``: a dataclass for each command, run by :mod:`.main`.

The comment above a field is the help of its option: of a docstring below it, tyro would
keep the line breaks. Each further line begins with a letter.

Options that several commands have are in :mod:`.options`, with the rules of their
names; former names are in :mod:`.parsing`.

``run()`` does the work and returns the exit status; it raises InputError if an option
or a file is wrong.
"""
