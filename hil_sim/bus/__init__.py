"""The CAN network: connections, messages of the database, their protection."""
