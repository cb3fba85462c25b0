"""Checks that several programs of these tests share."""


def raises(error, words, f, *args, **keywords):
    """Checks that a call raises an error with these words."""
    try:
        f(*args, **keywords)
    except error as found:
        assert words in str(found), found
        return
    raise AssertionError(f"{f} raised nothing")
