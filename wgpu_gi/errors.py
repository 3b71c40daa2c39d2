"""The one exception for what a user can put right: bad files, bad values, missing drivers."""


class GiError(Exception):
    """One sentence for the user: what is wrong, where (file, node, field) and what to do.

    The command line prints it without a traceback and exits with code 2.
    """
