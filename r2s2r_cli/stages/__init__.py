"""What each subcommand does, as functions from values to values. Nothing here touches the project on disk."""
