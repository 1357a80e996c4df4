"""The commands about archives: pack, check, make again."""
