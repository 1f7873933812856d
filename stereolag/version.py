"""Which release of the library this is: what an exported file says it was made by."""

VERSION = "0.1.0"
