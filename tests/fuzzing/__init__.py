"""Damages files of every kind and gives them to the command line.

``python -m tests.fuzzing --count 3000 --keep FOLDER`` takes about an hour on one core.
Every damaged input must be refused in one sentence, or lead to what the sound file
leads to, or to something else that is said: no traceback, no hang, no more than 2 GB,
nothing written elsewhere, no output half-written, no other result without a word. It
prints a table by kind and ends with status 1 if an input did otherwise; such inputs
stay in FOLDER, each with the command. Commands run in forks of one process; a few
inputs of each kind go to the installed command, too, which must say and do the same.
The same command goes on where it stopped; ``--seed`` draws others, ``--kinds`` takes
some kinds only. A few hundred of them run as tests.
"""
