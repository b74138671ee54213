"""Pictures from files, videos and topics."""
