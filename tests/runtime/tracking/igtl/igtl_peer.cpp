// SPDX-License-Identifier: Apache-2.0

// The other end of an OpenIGTLink connection, built with Debian's library only.
//     igtl_peer serve PORT N   server: sends N rounds of TRANSFORM, TDATA, QTDATA, POSITION, STATUS
//     igtl_peer send PORT N    client: sends N TRANSFORMs to a listening player
//     igtl_peer follow PORT N  client: receives until N images came; prints what it saw
#include <igtlClientSocket.h>
#include <igtlImageMessage.h>
#include <igtlMessageHeader.h>
#include <igtlOSUtil.h>
#include <igtlPositionMessage.h>
#include <igtlQuaternionTrackingDataMessage.h>
#include <igtlServerSocket.h>
#include <igtlStatusMessage.h>
#include <igtlTrackingDataMessage.h>
#include <igtlTransformMessage.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

namespace {

void quarter_turn(igtl::Matrix4x4& m, float x) {
    igtl::IdentityMatrix(m);
    m[0][0] = 0, m[0][1] = -1, m[1][0] = 1, m[1][1] = 0;  // about z
    m[0][3] = x, m[1][3] = -5, m[2][3] = 7;
}

template <class Message>
bool send(igtl::Socket* socket, Message& message) {
    message->Pack();
    return socket->Send(message->GetPackPointer(), message->GetPackSize()) != 0;
}

bool send_transform(igtl::Socket* socket, const char* name, float x) {
    igtl::TransformMessage::Pointer message = igtl::TransformMessage::New();
    message->SetDeviceName(name);
    igtl::Matrix4x4 m;
    quarter_turn(m, x);
    message->SetMatrix(m);
    return send(socket, message);
}

int serve(int port, int rounds) {
    igtl::ServerSocket::Pointer server = igtl::ServerSocket::New();
    if (server->CreateServer(port) < 0) return 1;
    std::printf("ready\n");
    std::fflush(stdout);
    igtl::ClientSocket::Pointer socket = server->WaitForConnection(20000);
    if (socket.IsNull()) return 2;
    for (int i = 0; i < rounds; ++i) {
        igtl::StatusMessage::Pointer status = igtl::StatusMessage::New();
        status->SetDeviceName("Server");
        status->SetStatusString("fine");
        bool ok = send(socket.GetPointer(), status);
        ok = ok && send_transform(socket.GetPointer(), "ProbeToTracker", 100);
        igtl::TrackingDataMessage::Pointer tdata = igtl::TrackingDataMessage::New();
        tdata->SetDeviceName("Tracker");
        igtl::TrackingDataElement::Pointer element = igtl::TrackingDataElement::New();
        element->SetName("NeedleToTracker");
        element->SetType(igtl::TrackingDataElement::TYPE_6D);
        igtl::Matrix4x4 m;
        quarter_turn(m, 200);
        element->SetMatrix(m);
        tdata->AddTrackingDataElement(element);
        ok = ok && send(socket.GetPointer(), tdata);
        igtl::QuaternionTrackingDataMessage::Pointer qtdata =
            igtl::QuaternionTrackingDataMessage::New();
        qtdata->SetDeviceName("Tracker");
        igtl::QuaternionTrackingDataElement::Pointer q = igtl::QuaternionTrackingDataElement::New();
        q->SetName("Third");
        q->SetPosition(300, -5, 7);
        const float h = std::sqrt(0.5f);
        q->SetQuaternion(0, 0, h, h);
        qtdata->AddQuaternionTrackingDataElement(q);
        ok = ok && send(socket.GetPointer(), qtdata);
        igtl::PositionMessage::Pointer position = igtl::PositionMessage::New();
        position->SetDeviceName("Fourth");
        position->SetPosition(400, -5, 7);
        position->SetQuaternion(0, 0, h, h);
        ok = ok && send(socket.GetPointer(), position);
        if (!ok) break;
        igtl::Sleep(8);
    }
    socket->CloseSocket();
    return 0;
}

int send_to(int port, int rounds) {
    igtl::ClientSocket::Pointer socket = igtl::ClientSocket::New();
    if (socket->ConnectToServer("127.0.0.1", port) != 0) return 1;
    for (int i = 0; i < rounds; ++i) {
        if (!send_transform(socket.GetPointer(), "ProbeToTracker", 100)) return 2;
        if (!send_transform(socket.GetPointer(), "NeedleToTracker", 200)) return 2;
        igtl::Sleep(8);
    }
    socket->CloseSocket();
    return 0;
}

int follow(int port, int images) {
    igtl::ClientSocket::Pointer socket = igtl::ClientSocket::New();
    int tries = 0;
    while (socket->ConnectToServer("127.0.0.1", port) != 0) {
        if (++tries > 200) return 1;
        igtl::Sleep(50);
    }
    int seen = 0, transforms = 0;
    float x = 0, spacing = 0;
    int size[3] = {0, 0, 0}, bad = 0;
    long sum = 0;
    while (seen < images) {
        igtl::MessageHeader::Pointer header = igtl::MessageHeader::New();
        header->InitPack();
        bool timeout = false;
        if (socket->Receive(header->GetPackPointer(), header->GetPackSize(), timeout) == 0)
            return 3;
        header->Unpack();
        if (std::strcmp(header->GetDeviceType(), "TRANSFORM") == 0) {
            igtl::TransformMessage::Pointer message = igtl::TransformMessage::New();
            message->SetMessageHeader(header);
            message->AllocatePack();
            socket->Receive(message->GetPackBodyPointer(), message->GetPackBodySize(), timeout);
            if (!(message->Unpack(1) & igtl::MessageHeader::UNPACK_BODY)) ++bad;
            igtl::Matrix4x4 m;
            message->GetMatrix(m);
            if (std::string(header->GetDeviceName()) == "ProbeToMannequin") x = m[2][3];
            ++transforms;
        } else if (std::strcmp(header->GetDeviceType(), "IMAGE") == 0) {
            igtl::ImageMessage::Pointer message = igtl::ImageMessage::New();
            message->SetMessageHeader(header);
            message->AllocatePack();
            socket->Receive(message->GetPackBodyPointer(), message->GetPackBodySize(), timeout);
            if (!(message->Unpack(1) & igtl::MessageHeader::UNPACK_BODY)) ++bad;
            message->GetDimensions(size);
            float s[3];
            message->GetSpacing(s);
            spacing = s[0];
            const auto* pixels = static_cast<const unsigned char*>(message->GetScalarPointer());
            sum = 0;
            for (int i = 0; i < size[0] * size[1]; ++i) sum += pixels[i];
            ++seen;
        } else {
            socket->Skip(header->GetBodySizeToRead(), 0);
        }
    }
    std::printf(
        "{\"images\": %d, \"transforms\": %d, \"bad\": %d, \"z\": %.3f, \"spacing\": %.4f, "
        "\"width\": %d, \"height\": %d, \"sum\": %ld}\n",
        seen, transforms, bad, x, spacing, size[0], size[1], sum);
    socket->CloseSocket();
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) return 64;
    const std::string verb = argv[1];
    const int port = std::atoi(argv[2]), n = std::atoi(argv[3]);
    if (verb == "serve") return serve(port, n);
    if (verb == "send") return send_to(port, n);
    if (verb == "follow") return follow(port, n);
    return 64;
}
