"""The release of the library, as recorded in exported files."""

VERSION = "0.1.0"
