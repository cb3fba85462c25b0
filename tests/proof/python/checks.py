"""What several programs of these tests check alike."""


def raises(error, words, f, *args, **keywords):
    """What is called raises this, with these words."""
    try:
        f(*args, **keywords)
    except error as found:
        assert words in str(found), found
        return
    raise AssertionError(f"{f} raised nothing")
