-- The database of the service, and the user it connects as: an ordinary one, who owns this database
-- and may enter no other. The image of PostgreSQL runs this by psql when it sets up its data.
\getenv password SYNCPLAN_DATABASE_PASSWORD
CREATE ROLE syncplan LOGIN NOSUPERUSER NOCREATEDB NOCREATEROLE NOREPLICATION PASSWORD :'password';
CREATE DATABASE syncplan OWNER syncplan;
REVOKE ALL ON DATABASE syncplan, postgres, template1 FROM PUBLIC;
-- without a password the superuser can't log in but inside the container
ALTER ROLE CURRENT_USER PASSWORD NULL;
