"""Why a pixel was matched as it was, and why it was not."""
