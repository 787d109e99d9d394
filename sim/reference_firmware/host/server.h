#ifndef SERVER_H
#define SERVER_H

#include "cm_drive.h"

/* How to serve; `speed` 0 = paced by the reader. `tcp_port` -1 = none, 0 = any; `rtu` a serial device or NULL. */
typedef struct {
    double speed;
    int tcp_port, baud;
    char parity;
    const char *rtu;
} server_options;

/* Serve until SIGINT or SIGTERM; 0, or 5 where the line cannot be had. */
int serve(cm_drive *drive, const server_options *options);

#endif
