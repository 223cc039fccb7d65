"""Bridges between collide and other libraries; nothing third-party is imported before it is asked for.

`collide.adapters.peers` asks other engines the same questions and compares the answers;
`collide.adapters.hosts` lets programs written for another engine run on collide.
"""
