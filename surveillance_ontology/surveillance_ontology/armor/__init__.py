"""The ARMOR directive service without ROS: what a directive means and what it answers.

`service.ArmorService` takes a `protocol.DirectiveRequest` and returns a `DirectiveResponse`; it
never raises. `client.ArmorClient` builds directives and reads answers over any transport. The node
and the ROS transport stand outside, in `armor_server_node` and `armor_client`.
"""
