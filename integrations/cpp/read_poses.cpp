// Prints live poses of an edge without keys: read_poses [HOST [COUNT [PORT CONTROL_PORT]]]. See README.md.
#include "poses.hpp"
#include <iomanip>
#include <iostream>
#include <zmq.hpp>

// Prints a line for each transform: position in metres, rows of the matrix, joint where a bone ends.
void print_pose(const Character& character, const Bytes& name, uint64_t sequence, const Bytes& data) {
    const auto pose = read_pose(character, data);
    std::cout << "pose " << sequence << ' ' << pose.size() << ' ' << name << '\n';
    for (size_t i = 0; i < pose.size(); i++) {
        for (double value : pose[i].position) std::cout << value << ' ';
        for (const auto& row : pose[i].matrix) for (double value : row) std::cout << value << ' ';
        std::cout << (character.names.empty() ? "" : character.names[i]) << '\n';
    }
    std::cout.flush();
}

void ask(zmq::socket_t& requests, const char* type, Map body) {
    body["type"] = Object(type);
    msgpack::sbuffer data;
    data.write("\1", 1);  // the version of the wire
    msgpack::packer<msgpack::sbuffer>(data).pack_map(2).pack("id").pack(1).pack("body").pack(body);
    requests.send(zmq::buffer(data.data(), data.size()), zmq::send_flags::none);
}

int main(int argc, char** argv) {
    const Bytes host = Bytes("tcp://") + (argc > 1 ? argv[1] : "127.0.0.1") + ":";
    const char* viewer = "C++ sample";
    long remaining = argc > 2 ? std::stol(argv[2]) : -1;
    zmq::context_t context;
    zmq::socket_t streams(context, zmq::socket_type::sub), requests(context, zmq::socket_type::dealer);
    streams.set(zmq::sockopt::subscribe, "");
    streams.connect(host + (argc > 3 ? argv[3] : "5580"));
    requests.connect(host + (argc > 4 ? argv[4] : "5581"));
    std::map<Bytes, Character> characters;
    std::array<uint64_t, 2> known{};  // instance and revision of the edge in the last reply to Hello
    std::cout << std::setprecision(9);
    while (remaining != 0) {
        zmq::pollitem_t items[] = {{streams, 0, ZMQ_POLLIN, 0}, {requests, 0, ZMQ_POLLIN, 0}};
        zmq::poll(items, 2);
        zmq::message_t message;
        while (requests.recv(message, zmq::recv_flags::dontwait)) {
            if (message.size() < 2 || message.to_string()[0] != 1) continue;
            const auto reply = msgpack::unpack(message.data<char>() + 1, message.size() - 1);
            Map body = reply->as<Map>().at("body").as<Map>();
            const Bytes type = body["type"].as<Bytes>();
            if (type == "Refused") std::cerr << "the edge refused: " << body["reason"].as<Bytes>() << '\n';
            if (type == "CharacterMessage") characters[body["id"].as<Bytes>()] = read_character(body);
            if (type != "Welcome") continue;
            const auto status = body["status"].as<List>();
            if (known[0] != status.at(1).as<uint64_t>()) characters.clear();  // the edge was restarted
            known = {status.at(1).as<uint64_t>(), status.at(2).as<uint64_t>()};
            for (const auto& entry : body["characters"].as<std::vector<List>>())
                ask(requests, "GetState", {{"character", entry.at(0)}});
        }
        while (remaining != 0 && streams.recv(message, zmq::recv_flags::dontwait)) {
            const Bytes data = message.to_string(), topic = data.substr(0, data.find('\0'));
            const size_t start = topic.size() + 2;  // after the zero and the version
            if (topic != "pose" && topic != "status") continue;
            if (data.size() <= start || data[start - 1] != 1) continue;  // another version of the wire
            const auto unpacked = msgpack::unpack(data.data() + start, data.size() - start);
            const auto fields = unpacked->as<List>();
            if (topic == "status") {
                if (known != std::array{fields.at(1).as<uint64_t>(), fields.at(2).as<uint64_t>()})
                    ask(requests, "Hello", {{"viewer", Object(viewer)}, {"listening", Object(true)}});
                continue;
            }
            const auto found = characters.find(fields.at(0).as<Bytes>());
            if (found == characters.end() || found->second.revision != fields.at(1).as<int64_t>() ||
                known[0] != fields.at(2).as<uint64_t>()) continue;
            print_pose(found->second, found->first, fields.at(3).as<uint64_t>(), fields.at(7).as<Bytes>());
            remaining--;
        }
    }
}
