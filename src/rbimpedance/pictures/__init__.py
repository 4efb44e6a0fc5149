"""Pictures: the viewer and its page, and figures by matplotlib.

May use: every room but `cli`. It is loaded when a picture is asked for.
"""
