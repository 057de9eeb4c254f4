"""What every package needs: errors, files, paths, archives, array types, compiling, progress."""
