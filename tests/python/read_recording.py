"""Reads a recording with MCAP's own reader (PyPI: mcap) and prints its content as JSON.

Usage: python3 read_recording.py RECORDING.mcap
"""

import json
import sys

from mcap.reader import make_reader


def main(path):
    seen = {"raw": "", "events": [], "poses": 0, "states": []}
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        seen["profile"] = reader.get_header().profile
        for schema, channel, message in reader.iter_messages():
            if channel.topic == "/tracker/raw":
                seen.setdefault("first_raw_time_ns", message.log_time)
                seen["raw_metadata"] = channel.metadata
                seen["raw"] += message.data.decode("latin-1")
            elif channel.topic == "/exam/events":
                seen["events"].append(json.loads(message.data))
            elif channel.topic == "/probe/pose":
                json.loads(schema.data)
                seen["pose_schema"] = [schema.name, schema.encoding]
                pose = json.loads(message.data)
                seen["last_pose"] = pose
                seen["poses"] += 1
                if pose["state"] not in seen["states"]:
                    seen["states"].append(pose["state"])
        seen["attachments"] = {a.name: a.data.decode() for a in reader.iter_attachments()}
        seen["metadata"] = {m.name: m.metadata for m in reader.iter_metadata()}
    json.dump(seen, sys.stdout)


if __name__ == "__main__":
    main(sys.argv[1])
