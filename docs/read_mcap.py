import sys
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    for _, _, message, truth in reader.iter_decoded_messages(topics=["/truth"]):
        at_s, position = message.log_time / 1e9, truth.actual.position_m
        if truth.tick % 100 == 0:
            print(f"{at_s:6.2f} s  north {position.x:7.3f}  east {position.y:7.3f}  down {position.z:7.3f} m")
