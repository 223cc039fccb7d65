"""Binary space partitions of solids, decided exactly: points located, and solids and free space as convex cells."""
